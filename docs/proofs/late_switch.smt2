; late_switch: theory §2.5. An answer that begins after its deadline and is withdrawn t later, before
; which everything was covered, leaves E at least -t D; its debt ends all credit, since E' is booked
; with the same loss.
(set-logic QF_NRA)
(declare-const E Real)   ; at the late switch
(declare-const A Real)   ; at the withdrawal
(declare-const t Real)
(declare-const D Real)
(declare-const d Real)   ; displacement against the force
(declare-const x Real)   ; (|F| - fco)+
(declare-const fd Real)
(assert (and (> fd 0) (>= x 0) (> t 0) (>= d 0)))
(assert (>= E 0))  ; dropped in the twin
(assert (= (* 4 fd D) (* x x)))
(assert (>= (* t (- A E)) (- (* fd d d) (* x d t))))
(assert (>= (* (- (* 2 fd d) (* x t)) (- (* 2 fd d) (* x t))) 0))  ; hint
(assert (= (* x x t t) (* 4 fd D t t)))  ; hint
(assert (=> (< A (* (- t) D)) (< (* 4 fd t (- A E)) (* (- 4) fd t t D))))  ; hint
(assert (>= (* 4 fd t (- A E)) (* 4 fd (- (* fd d d) (* x d t)))))  ; hint
(assert (< A (* (- t) D)))  ; negated conclusion
(check-sat)
