; port_doubt: theory §2.8. A displacement d that is known as d1 only, within R, makes one interval of
; length t count too much by at most (|f| + fco + fd (2 V + R/t)) R, whatever h within fco stands for
; Coulomb friction (held_friction). A = |f|, a = |d|, the hand no faster than V.
(set-logic QF_NRA)
(declare-const fd Real)
(declare-const fco Real)
(declare-const f Real)
(declare-const A Real)
(declare-const h Real)
(declare-const d Real)
(declare-const a Real)
(declare-const d1 Real)
(declare-const t Real)
(declare-const V Real)
(declare-const R Real)
(declare-const c Real)   ; what is counted
(declare-const E Real)   ; what the interval gave
(assert (and (>= fd 0) (>= fco 0) (> t 0) (> V 0) (>= R 0)))
(assert (= A (ite (>= f 0) f (- f))))
(assert (= a (ite (>= d 0) d (- d))))
(assert (and (<= h fco) (<= (- h) fco)))
(assert (<= a (* V t)))
(assert (and (<= (- d1 d) R) (<= (- d d1) R)))  ; dropped in the twin
(assert (= (* c t) (+ (* (+ f h) d1 t) (* fd d1 d1))))
(assert (>= (* E t) (+ (* f d t) (* fco a t) (* fd d d))))
(assert (<= (* f (- d1 d)) (* A R)))  ; hint
(assert (<= (* h (- d1 d)) (* fco R)))  ; hint
(assert (<= (* h d) (* fco a)))  ; hint
(assert (<= (* (- d1 d) (+ d1 d)) (* R (+ (* 2 V t) R))))  ; hint
(assert (<= (* fd (- d1 d) (+ d1 d)) (* fd R (+ (* 2 V t) R))))  ; hint
(assert (<= (* (+ (* (+ f h) d1) (- (* f d)) (- (* fco a))) t) (* (+ A fco) R t)))  ; hint
(assert (> (* c t) (+ (* E t) (* (+ A fco) R t) (* fd R (+ (* 2 V t) R)))))  ; negated conclusion
(check-sat)
