; gate: theory §2.7. fco + g (f_max - fco) with 0 <= g <= 1 is at most f_max, and with a lower bound
; the drain is no higher.
(set-logic QF_NRA)
(declare-const fco Real)
(declare-const m Real)   ; f_max
(declare-const g Real)
(declare-const n Real)   ; behind the gate
(assert (and (>= fco 0) (>= m fco) (>= g 0)))
(assert (<= g 1))  ; dropped in the twin
(assert (= n (+ fco (* g (- m fco)))))
(assert (and (<= 0 (* g (- m fco))) (<= (* g (- m fco)) (- m fco))))  ; hint
(assert (<= (* (- n fco) (- n fco)) (* (- m fco) (- m fco))))  ; hint
(assert (or (> n m) (< n fco) (> (* (- n fco) (- n fco)) (* (- m fco) (- m fco)))))  ; negated conclusion
(check-sat)
