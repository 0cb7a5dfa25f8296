; one_interval: theory §2.1, (13). What a force within f_max can lose in one interval of any length T
; and any displacement d is no more than E'. Multiplied by T.
(set-logic QF_NRA)
(declare-const fd Real)   ; viscous friction, N s/m
(declare-const fco Real)  ; Coulomb friction, N
(declare-const T Real)    ; s
(declare-const E Real)    ; E', J
(declare-const s Real)    ; sqrt(fd E' / T)
(declare-const f Real)    ; component of the held force against the displacement, N
(declare-const d Real)    ; |displacement|, m
(assert (and (>= fd 0) (>= fco 0) (> T 0) (>= E 0) (>= d 0)))
(assert (and (>= s 0) (= (* s s T) (* fd E))))
(assert (<= f (+ fco (* 2 s))))  ; dropped in the twin
(assert (>= (* (- (* fd d) (* s T)) (- (* fd d) (* s T))) 0))  ; hint
(assert (= (* s s T T) (* fd E T)))  ; hint
(assert (=> (> fd 0) (>= (+ (* fd d d) (* E T)) (* 2 s T d))))  ; hint
(assert (=> (= fd 0) (= s 0)))  ; hint
(assert (>= (* T d (- (+ fco (* 2 s)) f)) 0))  ; hint
(assert (< (+ (* E T) (* fd d d) (* fco d T) (* (- f) d T)) 0))  ; negated conclusion
(check-sat)
